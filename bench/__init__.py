"""Benchmarks of the kernels and the step: each states the claim that it defends.

results/ has what was measured, studies/ the scientific questions.
"""
