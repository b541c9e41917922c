"""What is done with an arm beside a plain run: small moves, planning again while it moves, going on after a break."""
