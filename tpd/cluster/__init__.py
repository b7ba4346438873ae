"""Long work on several processes or machines."""
