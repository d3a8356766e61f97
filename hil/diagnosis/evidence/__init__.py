"""What bears a finding out: its place, parts that no fit has seen, what these data cannot show."""
