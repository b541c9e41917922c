"""From a route to the fastest motion along it: optimised, gentle, and slower where that is asked for."""
