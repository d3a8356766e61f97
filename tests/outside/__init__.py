"""An observer from outside: what stands at the device is held against everything that the program says of it.

python -m tests.outside --seeds FROM TO
"""
