"""What a valve takes along: one signed file per unit that anybody can open, check and run again."""
