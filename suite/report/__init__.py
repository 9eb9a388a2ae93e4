"""Figures and pages from finished results; nothing is computed here."""
