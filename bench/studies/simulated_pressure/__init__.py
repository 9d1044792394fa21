"""Is the simulated pressure right where nothing flows?"""
