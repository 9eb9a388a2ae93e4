"""The workbench page: a server on the loopback interface, and the processes that compute for it."""
