"""Plants that are no valves: tanks, drives, dampers, a throttle, loops. They join as a stranger's package would."""
