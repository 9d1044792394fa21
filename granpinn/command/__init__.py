"""What the commands share: cli and completion of `granpinn VERB`, parser, settings as arguments."""
