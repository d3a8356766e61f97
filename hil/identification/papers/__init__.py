"""The published methods of the three valves' papers."""
