"""Patches built from curves: one module for each kind."""
