"""How far off is the law with noisy velocities?"""
