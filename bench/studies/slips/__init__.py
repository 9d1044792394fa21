"""Are slips of calibration caught before a training?"""
