"""What do differences and a regression find without a network?"""
