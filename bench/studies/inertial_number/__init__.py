"""Do velocities determine I0?"""
