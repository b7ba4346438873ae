"""Pictures of designs, responses and maps. Functions take data and axes, and return the axes."""
