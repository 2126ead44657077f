"""The posterior of an observation: densities, their averages and products, draws and pictures."""
