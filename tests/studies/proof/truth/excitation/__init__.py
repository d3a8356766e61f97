"""What is played to each plant: healthy, changed and unseen recordings differ in amplitude, bias and seed."""
