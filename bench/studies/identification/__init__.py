"""How accurate is the default identification?"""
