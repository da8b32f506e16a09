"""The method of Román et al., Appl. Sci. 2020, 10(18), 6480, doi 10.3390/app10186480, in a folder of its own."""
