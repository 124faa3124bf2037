"""Figures as the pages show them, and bars as faults name them."""


def number(value):
    """Two digits; nothing at all as 0."""
    return "0" if value == 0 else f"{value:.1e}" if value < 1e-3 else f"{value:.2g}"


class Bars:
    """What has missed its bar, one line each."""

    def __init__(self, of):
        self.of, self.missed = of, []

    def hold(self, value, bar, what):
        """Not a number has missed."""
        if not value <= bar:
            self.missed.append(f"{self.of}: {what} {value:.3g}, {bar:.3g} at most")
