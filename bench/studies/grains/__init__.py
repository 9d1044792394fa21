"""Does the identification survive real grains? Flows of discrete elements with a measured law."""
