"""The models that answer a scene, a file each, behind one interface."""
