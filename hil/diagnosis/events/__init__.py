"""Causes without a law: samples or commands held or lost at random moments, and tones with a phase of their own.

They happen when they happen, so no simulation can foresee them; they are recognised by what they leave behind.
"""
