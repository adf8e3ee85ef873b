"""``pandion bench``: the optimiser, the loop in real time, lockstep, and a flooded link."""
