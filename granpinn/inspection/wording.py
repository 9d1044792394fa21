"""Numbers and factors in words."""


def digits(value: float) -> str:
    """Two significant digits, such as "0.12", "3.2" or "4,000"."""
    return f"{float(f'{value:.2g}'):,g}" if abs(value) < 1e6 else f"{value:.1e}"


def about(ratio: float) -> str:
    """A factor with two digits, such as "980 times" or "1/980 of"."""
    text = digits(max(ratio, 1 / ratio))
    return f"{text} times" if ratio >= 1 else f"1/{text} of"
