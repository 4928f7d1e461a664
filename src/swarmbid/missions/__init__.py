"""What a vehicle does on a mission: behaviours on top of the algorithms, without clock or input of their own.

A driver (the simulated world, or a vehicle) tells a behaviour what its sensors saw and what it heard;
the behaviour says where to fly and what to tell the others.
"""
