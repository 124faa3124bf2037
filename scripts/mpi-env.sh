# Sourced: lets Open MPI work, silently, as root and in a container or bare root; and on one rank without mpirun, with no daemon.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_btl_vader_single_copy_mechanism=none OMPI_MCA_plm_rsh_agent=
export OMPI_MCA_rmaps_base_oversubscribe=1 OMP_NUM_THREADS=1
export OMPI_MCA_ess_singleton_isolated=1
export OMPI_MCA_pml=ob1   # one machine needs no network, whose drivers take 0.2 s at each start
