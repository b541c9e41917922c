"""What an arm can do where: accuracy, speed and manipulability over the workspace, the largest payload and feed."""
