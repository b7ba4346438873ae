"""Answers to questions about one design, one kind of question in each module."""
