"""Imported first by the process from which the computing ones are forked, which else would finish loading alone."""

from suite.processes import die_with_parent

die_with_parent()
