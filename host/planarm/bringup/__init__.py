"""Bringing an arm up: what it is made of, asked and checked; which way its joints turn; how long its links are."""
