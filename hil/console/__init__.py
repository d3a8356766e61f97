"""The operator's console: pages that read run folders while they are written, and start runs as processes of their own.

Nothing that a run needs is here. The stop button speaks to the run's own listener, not to this server.
"""
