"""What may happen to a stored file."""

WAYS = ("cut", "empty", "zeroed", "flipped")


def damage(path, way):
    """Damage a file that is not empty."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 16
    ways = {"cut": content[: len(content) // 2], "empty": b"", "zeroed": bytes(len(content))}
    path.write_bytes(ways.get(way, content))
