"""Is the simulator right, and how fast is it?"""
