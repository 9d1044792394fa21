"""Several flows of one material: does one law from all of them find I0, and is it right?"""
