"""Error budget of a machine: its rows, its lines on the terminal, and the page plant.html."""
