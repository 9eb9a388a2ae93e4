"""Imported once by the process from which the computing ones are forked: what all of them need is loaded then."""

from suite import plugins
from suite.web import tasks as tasks

plugins.effects()
plugins.cases()
