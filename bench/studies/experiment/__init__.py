"""How much of the friction law survives a camera, a PIV program and a conversion?"""
