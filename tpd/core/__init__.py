"""Foundations: scene, parameters, conditions, equations, statuses, batches."""
