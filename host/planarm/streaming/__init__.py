"""From a certified plan to the line: where the arm stands, how the plan is streamed, and how appointments are kept."""
