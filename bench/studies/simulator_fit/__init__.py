"""What can a method reach that may use the simulator? And what do the data hold at most?"""
