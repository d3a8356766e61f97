// The stop button: see the place that base.html keeps for it.
