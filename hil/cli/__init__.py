"""The command line: its commands, a file each, and what they share; heavy imports happen inside a command."""
