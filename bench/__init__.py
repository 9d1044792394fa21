"""Benchmarks of the kernels and the step: each states the claim that it defends.

results/ has the measurements, studies/ the scientific questions.
"""
