"""What bad meshes do to each method: runs on the disk's mesh made worse on purpose."""
