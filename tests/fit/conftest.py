"""The tests of this folder have a coarser flow."""

from tests.coarse_flow import flow, flow_file

__all__ = ["flow", "flow_file"]
