"""Factors in words."""


def about(ratio: float) -> str:
    """A factor with two digits, such as "980 times" or "1/980 of"."""
    size = max(ratio, 1 / ratio)
    text = f"{float(f'{size:.2g}'):,g}" if size < 1e6 else f"{size:.1e}"
    return f"{text} times" if ratio >= 1 else f"1/{text} of"
