"""Numbers that papers print about valves, one file per paper, with the equation or table they stand in."""
