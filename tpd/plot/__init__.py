"""Pictures: data in, axes out."""
