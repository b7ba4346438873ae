"""Designs for many conditions at once: what is asked, the search, the judge and the answer."""
