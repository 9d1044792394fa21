"""What a non-local material looks like to local laws."""
