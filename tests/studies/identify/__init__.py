"""How often what is identified holds the truth, on recordings of simulations that share nothing with the fit."""
