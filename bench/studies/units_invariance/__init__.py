"""Do units or a tilted camera change the law?"""
