"""Reports of results: text, HTML, JSON."""
