"""The verdict on one law: planted violations."""
