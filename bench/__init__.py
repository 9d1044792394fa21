"""Benchmarks. Each states the claim that it defends; results/ keeps what was measured."""
