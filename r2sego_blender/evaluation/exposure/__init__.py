"""At which exposure pictures of the scene are compared with held-out photographs: told by the captures alone."""
