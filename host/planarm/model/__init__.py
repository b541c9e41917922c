"""The arm as geometry: links, kinematics, shapes of obstacles, distances between them."""
