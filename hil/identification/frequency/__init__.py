"""What is measured with sines and multisines, and transfer functions fitted to it."""
