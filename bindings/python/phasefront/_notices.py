"""The notices of the code that the library includes."""

from importlib.resources import files


def third_party_notices() -> str:
    """Returns the third-party notices of the library as Markdown. An app must show them with its own notices."""
    return files("phasefront").joinpath("THIRD-PARTY.md").read_text(encoding="utf-8")
