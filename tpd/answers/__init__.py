"""Questions about one design, one question a module."""
