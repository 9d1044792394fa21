"""What the commands share: the console command (cli), parser, exit codes, words for the user."""
