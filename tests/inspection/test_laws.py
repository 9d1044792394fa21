"""The expected precision for every friction law."""
