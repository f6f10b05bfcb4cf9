"""Analysis of F(x, dq/dt; p) = 0: time stepping, events. Knows neither surfaces nor grids."""
